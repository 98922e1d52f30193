%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE OddLayout
  PERS tooldata tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];
  PERS wobjdata wPanel:=[FALSE,TRUE,"",[[1500,0,500],[1,0,0,0]],[[300,-250,300],[1,0,0,0]]];
  CONST   robtarget
      pX   := [ [ 0 , 155.5 ,
                  395 ] ,
                [0.707107,0,0.707107,0] ,   ! orientation
                [ 0 , 0 , 0 , 0 ] ,
                [9E9,9E9,9E9,9E9,9E9,9E9] ] ;
  PROC main()
    MoveL
      pX ,
      v100 , fine ,
      tSpindle \WObj := wPanel ;
    movel px, v100, z5, TSPINDLE\wobj:=WPANEL;
    IF di1=1 THEN MoveL Offs ( pX , -1 , 0 , 0 ) , v100 , fine , tSpindle \WObj := wPanel ; ENDIF
  ENDPROC
ENDMODULE
